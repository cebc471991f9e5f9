//! Which instructions the kernels run on.

use pulp::{Simd, WithSimd};

/// An instruction set that the kernels are compiled for and that this machine has.
///
/// # Accuracy
///
/// AVX-512 and AVX2 both fuse each multiplication with its addition and sum in the same order, so
/// results have the same bits. The portable path rounds twice where the others round once.
#[derive(Clone, Copy, Debug)]
pub struct Isa(Kind);

#[derive(Clone, Copy, Debug)]
enum Kind {
    #[cfg(target_arch = "x86_64")]
    Avx512(pulp::x86::V4),
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    #[cfg(not(target_arch = "x86_64"))]
    Native(pulp::Arch),
    Portable,
}

impl Isa {
    /// The fastest that this machine has.
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if let Some(simd) = pulp::x86::V4::try_new() {
                return Isa(Kind::Avx512(simd));
            }
            if let Some(simd) = pulp::x86::V3::try_new() {
                return Isa(Kind::Avx2(simd));
            }
            Isa(Kind::Portable)
        }
        #[cfg(not(target_arch = "x86_64"))]
        Isa(Kind::Native(pulp::Arch::new()))
    }

    /// Plain Rust on arrays of four, for any machine.
    pub fn portable() -> Self {
        Isa(Kind::Portable)
    }

    /// All that this machine has, the fastest first.
    pub fn all() -> Vec<Self> {
        let mut all = vec![Isa::best()];
        #[cfg(target_arch = "x86_64")]
        if let (Kind::Avx512(_), Some(simd)) = (all[0].0, pulp::x86::V3::try_new()) {
            all.push(Isa(Kind::Avx2(simd)));
        }
        if !matches!(all[0].0, Kind::Portable) {
            all.push(Isa::portable());
        }
        all
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(_) => "AVX-512",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(_) => "AVX2",
            #[cfg(not(target_arch = "x86_64"))]
            Kind::Native(_) => "native",
            Kind::Portable => "portable",
        }
    }

    /// Runs `op` compiled for this instruction set.
    #[inline]
    pub(crate) fn run<Op: WithSimd>(self, op: Op) -> Op::Output {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(simd) => Simd::vectorize(simd, op),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(simd) => Simd::vectorize(simd, op),
            #[cfg(not(target_arch = "x86_64"))]
            Kind::Native(arch) => arch.dispatch(op),
            Kind::Portable => Simd::vectorize(pulp::Scalar128b, op),
        }
    }
}

/// `a·b + c`: fused where the machine can, else rounded twice (the C library's fused
/// multiply-add would cost a call per number).
#[inline(always)]
pub(crate) fn fma<S: Simd>(simd: S, a: S::f32s, b: S::f32s, c: S::f32s) -> S::f32s {
    if S::F32_LANES >= 8 || cfg!(target_arch = "aarch64") {
        simd.mul_add_f32s(a, b, c)
    } else {
        simd.add_f32s(simd.mul_f32s(a, b), c)
    }
}
