"""What can be done with a recording afterwards: look into it, measure, compare, mend, draw."""
