//! Analytic fields and meshes with known answers.
