"""sim_vehicle."""
