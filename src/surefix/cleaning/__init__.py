"""What happens to records before a filter sees them: clocks, order, duplicates, held fixes."""
