"""How far six seconds of the ROBOTIS walk go when masses, friction, step and contact model are not quite known."""
