//! The normal equations `(JᵀJ + μI) δ = −Jᵀe` of the network's squared errors, without ever forming J.
//!
//! With A = [inputs, 1], H̃ = [H, 1], D = 1 − H∘H, V̄ = V without its biases, and B the row-wise Kronecker product of D
//! and A (samples × h·n1), the Jacobian of output t is `[B diag(V̄ₜ ⊗ 1), H̃]`, hence
//!
//! ```text
//! JwᵀJw = (V̄V̄ᵀ ⊗ 1) ∘ BᵀB       block t of JwᵀJv = diag(V̄ₜ ⊗ 1) C,  C = BᵀH̃       JvᵀJv = I ⊗ H̃ᵀH̃
//! S = μI + (V̄V̄ᵀ ⊗ 1) ∘ (BᵀB − C G⁻¹ Cᵀ),   G = H̃ᵀH̃ + μI       (Schur complement on W)
//! ```
//!
//! Two implementations of [`HiddenSolver`](hidden_solver::HiddenSolver) solve with S. For the usual networks S is formed
//! and factored. Its order is h·n1, so for wide ones conjugate gradients, which never form S, are cheaper; the choice is
//! made by the number of multiplications.
//!
//! Hidden weights are numbered node by node here: weight (i, a) is i·n1 + a.

mod choice;
mod cholesky;
mod conjugate;
mod cost;
#[cfg(test)]
mod dense;
mod elimination;
mod equations;
mod hidden_solver;
mod output_layer;
mod products;
mod schur;
mod sums;
mod weight_classes;

pub(super) use equations::{FactoredEquations, NormalEquations};
pub(super) use weight_classes::{Decay, PerClass, class_sizes, class_squares};
