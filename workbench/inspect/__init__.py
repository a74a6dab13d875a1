"""What a file is and what is wrong with it: recognised by content, checked against the robot that it belongs to."""
