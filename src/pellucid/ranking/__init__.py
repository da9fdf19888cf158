"""Controllers ranked on one page: every strategy that is reviewed, at elbow and knee, over people and robots."""
