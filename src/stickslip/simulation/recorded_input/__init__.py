"""An axis driven by a recorded signal, as identification simulates it."""
