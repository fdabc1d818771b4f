"""Black-box identification by any method: data on an even grid, the methods, the choice of an order."""
