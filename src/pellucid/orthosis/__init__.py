"""An orthosis and its wearer: strap, inertial sensors, transfer function, loaded swings, study."""
