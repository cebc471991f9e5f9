//! Floats on a cache-line boundary.

/// A buffer of f32 whose first element lies on a 64-byte boundary: a vector load that straddles
/// two lines costs two.
#[derive(Debug, Default)]
pub(crate) struct Aligned {
    data: Vec<f32>,
    start: usize,
    len: usize,
}

/// Floats of a cache line.
const LINE: usize = 16;

impl Aligned {
    /// `len` zeros.
    pub(crate) fn zeroed(len: usize) -> Self {
        let data = vec![0.0; len + LINE];
        // `align_offset` may decline to answer (usize::MAX): then the buffer is only unaligned.
        let start = data.as_ptr().align_offset(4 * LINE).min(LINE);
        Aligned { data, start, len }
    }

    pub(crate) fn as_slice(&self) -> &[f32] {
        &self.data[self.start..self.start + self.len]
    }

    pub(crate) fn as_mut_slice(&mut self) -> &mut [f32] {
        &mut self.data[self.start..self.start + self.len]
    }
}

impl Clone for Aligned {
    fn clone(&self) -> Self {
        let mut copy = Aligned::zeroed(self.len);
        copy.as_mut_slice().copy_from_slice(self.as_slice());
        copy
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_float_lies_on_a_cache_line() {
        for len in [0, 1, 7, 1000] {
            let mut buffer = Aligned::zeroed(len);
            assert_eq!(buffer.as_slice().len(), len);
            assert_eq!(buffer.as_slice().as_ptr() as usize % 64, 0);
            buffer.as_mut_slice().fill(1.0);
            let copy = buffer.clone();
            assert_eq!(copy.as_slice(), buffer.as_slice());
            assert_eq!(copy.as_slice().as_ptr() as usize % 64, 0);
        }
    }
}
