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
//! For the usual networks S is formed and factored. Its order is h·n1, so that for wide ones conjugate gradients are
//! cheaper, to a relative residual of 1e-8, and S is never formed: [`Way`] decides by the number of multiplications.
//!
//! Hidden weights are numbered node by node here: weight (i, a) is i·n1 + a.

mod cholesky;
mod conjugate;
mod cost;
mod elimination;
mod equations;
mod output_layer;
mod products;
mod schur;

pub(super) use cost::Way;
pub(super) use equations::NormalEquations;
