"""From records to a law: one file a method, each with a function that returns an `Identification`."""
