//! The peak memory of this process.

/// The largest resident memory of this process so far, in bytes; `None` on a system without
/// `/proc/self/status`.
pub(crate) fn peak_memory() -> Option<u64> {
    peak_in(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// Of the text of `/proc/self/status`, the value of the line `VmHWM:     1234 kB`.
fn peak_in(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kib.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_read_where_it_stands() {
        let status = "Name:\tifg\nVmPeak:\t  900 kB\nVmHWM:\t   85012 kB\nVmRSS:\t  80000 kB\n";
        assert_eq!(peak_in(status), Some(85012 * 1024));
        for other in ["", "VmHWM:\t 12 MB\n", "VmHWM:\n", "VmHWM:\t99999999999999999999 kB\n"] {
            assert_eq!(peak_in(other), None, "{other:?}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_peak_grows_with_what_is_touched() {
        let before = peak_memory().unwrap();
        let much = vec![1_u8; 2 * before as usize];
        assert!(peak_memory().unwrap() > before && much.iter().all(|byte| *byte == 1));
    }
}
