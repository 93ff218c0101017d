"""What a whole robot does: the torques of an arm's links, the virtual one."""
