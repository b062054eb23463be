"""Set values that bring the tool point of the identified machine to where it is wanted."""
