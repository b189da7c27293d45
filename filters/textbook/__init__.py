"""The exercises of chapter 4 of *Probabilistic Robotics*, and what its figures show, computed by the project's filters.

Arrays in, values of arrays out: nothing is drawn or printed here. ``beliefd textbook`` does that, with
``service/textbook/``.

============== ================================================================================
file           what
============== ================================================================================
``car``        the linear system of exercises 1 and 4: position and velocity, z = 5 at t = 5
``ring``       the nonlinear system of exercises 2 and 5: x + cos θ, y + sin θ, heading unknown
``bias``       exercise 3: what one particle, or two, make of a measurement; equation 4.38
``transform``  the chapter's standard example, a Gaussian through a nonlinear function
``histogram``  figure 4.1: that example as a histogram, equations 4.1 and 4.2
``partition``  figure 4.2: a static grid and a density tree with equally many cells
``particles``  figures 4.3 and 4.6: that example as particles, and how much chance is in them
``importance`` figure 4.4: target, proposal and importance factors, equations 4.25 to 4.28
``extraction`` figure 4.5: four densities out of one set of particles
``comb``       figure 4.7: the principle of low-variance resampling, equation 4.37
``landmarks``  the lecture's robot among landmarks, and the 2 that its Gaussian forgets
``wheel``      the lecture's resampling wheel against multinomial resampling
============== ================================================================================
"""
