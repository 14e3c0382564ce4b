"""Reading and writing bags, tf lookup in a bag, and the offline pipeline on a bag."""
