"""Where runs come from: foreign files, the virtual robot, what is shipped."""
