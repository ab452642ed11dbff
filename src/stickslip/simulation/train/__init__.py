"""A train of inertias under a held torque, its contact made of elements: cut where one breaks away or turns."""
