"""Behind the workbench node: messages to the page, orders from it."""
