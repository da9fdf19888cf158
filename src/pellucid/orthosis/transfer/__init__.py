"""From commanded to measured: transfer functions, refined instrumental variables, a pendulum in grey."""
