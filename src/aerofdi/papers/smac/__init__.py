"""The paper "smac": one small filter, active excitation, actuator by actuator."""
