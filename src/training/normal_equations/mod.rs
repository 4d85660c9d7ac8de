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
//! Hidden weights are numbered node by node here: weight (i, a) is i·n1 + a.

mod cholesky;
mod equations;
mod output_layer;
mod products;
mod schur;

pub use equations::NormalEquations;
