"""Behind the controller node: its controller from the parameters, and the streams that it follows."""
