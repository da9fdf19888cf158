"""One joint: regression of its parameters, physical bounds, closed-loop methods, and static holds."""
