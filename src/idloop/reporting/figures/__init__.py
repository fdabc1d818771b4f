"""Interactive figures (Bokeh) of the report and of the live page, from plain library objects: no server, no ROS.

Every function takes a `theme` and returns Bokeh figures; the caller lays them out. Figures that belong together
share their x range.

================================================  =====================================================
`comparison.overlay(panel)`                       measured and model, residual with band, command
`comparison.force_figures(models, unit)`          applied and needed drive force
`where.error_along(maps, variable)`               error over velocity, position, frequency, command, ...
`where.error_in_time(one)`                        error over time with its worst stretches
`ladder.ladder_figures(ladder, floor)`            error of every step down to the noise floor
`effects.candidates_figure(rows)`                 what is missing, what ties, what cannot be shown
`curves.characteristic_figure(one)`               an effect's curve on the data that asked for it
`curves.unknown_figure(unknown)`                  the force that no effect explains
`next_experiment.experiment_figures(suggestion)`  what is sent in and what each rival would show
`comparison.residual_figures(test)`               correlations of the residual
`curves.describing_figures(measured)`             gain and phase over amplitude
================================================  =====================================================
"""
