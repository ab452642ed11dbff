"""Controllers compared over cases: a study is a TOML file; `thesis.toml` ships with the package."""
