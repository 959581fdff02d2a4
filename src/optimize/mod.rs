//! From a start to an optimised design: objectives, their exact derivatives through equilibrium, and
//! the solvers (Megaro et al. 2017, section 4). The only client of argmin.

mod box_qp;
mod cma_es;
mod guards;
mod lbfgs;
mod levenberg;
mod normal;
pub mod objectives;
mod problem;
mod run;
mod shared;

pub use box_qp::{Hinge, Quadratic};
pub use normal::Normal;
pub use problem::{Derivatives, Problem, Trial};
pub use run::{Ending, Method, Optimized, optimize};
pub use shared::Iteration;
