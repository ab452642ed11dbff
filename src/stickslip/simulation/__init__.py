"""How axis, controller and reference run together."""
