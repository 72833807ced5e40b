"""Methods held against each other, through the product itself, on logs whose faults are known."""
