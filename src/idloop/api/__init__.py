"""The public functions and results: what `import idloop` offers; command line, nodes and workbench call these."""
