"""The robot program's end of its helper process: started, served, waited for, and told of what clients ask."""
