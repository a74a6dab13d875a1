"""The figures of the README, measured side by side in one run; without MuJoCo's robot (studies/) its figure is left out."""
