"""Behind the estimator node: fits, diagnoses and monitoring in a worker process."""
