"""A virtual series-elastic knee orthosis and its wearers."""
