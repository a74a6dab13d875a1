"""Two takes, or a session and a model, side by side: reading, registration, errors, footfalls, prediction."""
