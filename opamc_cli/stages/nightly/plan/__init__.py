"""What is to be done of a robot's nights, and why: no recording is opened here."""
