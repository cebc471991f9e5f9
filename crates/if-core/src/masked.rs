//! Masked fields (Appendix C).
