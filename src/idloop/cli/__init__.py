"""The command `idloop`: one file per verb, loaded when the verb is used."""
