"""From rigid bodies of motion capture to joint angles: repair, registration, observation of simulated takes."""
