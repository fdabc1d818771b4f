"""The next experiment: which motion tells models or effects apart, within what a machine bears."""
