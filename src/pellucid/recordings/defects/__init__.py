"""What goes wrong in recordings: a file for each kind of defect, which finds it and says where."""
