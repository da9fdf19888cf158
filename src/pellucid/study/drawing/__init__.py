"""Drawing: colours, sizes and shapes that every figure shares."""
