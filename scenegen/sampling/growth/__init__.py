"""Growth: sequential Monte Carlo over objects, for tables whose scenes are too rare to be met by chance."""
