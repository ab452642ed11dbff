"""From an identified model to a setting of a compensator that is safe to switch on."""
