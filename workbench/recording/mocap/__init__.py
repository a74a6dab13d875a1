"""From rigid bodies of motion capture to joint angles: mending, registration, observation of simulated takes."""
