//! On one seed: falsifications are applied, seen and scored as they are meant to be.
