"""One joint: regression of its parameters, what is physically possible, closed-loop methods, holds."""
