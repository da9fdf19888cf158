"""The series-elastic knee orthosis and what it leaves of its own impedance."""
