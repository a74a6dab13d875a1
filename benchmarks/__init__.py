"""The speeds that the documentation states, measured side by side in one run; without MuJoCo's robot (studies/) its
figure is left out."""
