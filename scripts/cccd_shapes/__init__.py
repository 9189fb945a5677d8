"""One closed spline with the same quads on every subject of a cohort; how shapes vary, how groups differ."""

#: Fewest subjects that have a mean and a mode; control points, about, where nobody says how many.
FEWEST, POINTS = 3, 800
#: Rounds: the template is the medoid in the first, the mean of those that fit in the others. From the third
#: on all control points move by themselves from the mean, so that none slides without need.
ROUNDS, FROM_MEAN = 5, 3
