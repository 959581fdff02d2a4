//! Bound on von Mises stress.
