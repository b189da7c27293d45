"""A simulated rover with a truth, which says only what a real one says: MAVLink and DroneCAN bytes.

The truth (:mod:`~sim_vehicle.world`) drives a course; sensors (:mod:`~sim_vehicle.sensors`) observe it, each
with its own rate, delay, noise and random numbers; an autopilot (:mod:`~sim_vehicle.autopilot`) and a CAN bus
(:mod:`~sim_vehicle.bus`) put the readings on the wire, stamped by clocks of their own. ``python -m
sim_vehicle`` runs it against the host's clock or writes its logs faster than real time.
"""
