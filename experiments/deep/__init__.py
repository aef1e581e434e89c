"""What tables do not hold: tasks with several movable objects, learnt by a network, from scenes in several orders."""
