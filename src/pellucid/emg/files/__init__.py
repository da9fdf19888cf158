"""Files of muscles: OpenSim and CEINMS."""
