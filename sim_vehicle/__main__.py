"""``python -m sim_vehicle``."""

from sim_vehicle.cli import main

if __name__ == "__main__":
    main()
