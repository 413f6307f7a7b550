"""A simulated plant: how an arm with inertia, friction and play follows its setpoints."""
