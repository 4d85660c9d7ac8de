use std::fs;

use decoupler_core::machine::MemoryBudget;
use thiserror::Error;

use super::memory::{bytes_of, memory_budget};

/// Memory that reading one file may take: half of the free memory or, if the user has set a limit, all of that.
///
/// Readers [`claim`](Self::claim) what they are about to allocate, also while they decompress, so that a small file that
/// claims or inflates to gigabytes is refused instead of ending the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadingBudget {
    limit: u64,
    used: u64,
    is_given: bool,
}

/// A file needs this number of bytes, which is more than the budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "it needs {} of memory, and reading may use {}{}; use a part of it, or raise the memory limit or \
     the environment variable {} (in GB)",
    size(*.0),
    size(.1.limit),
    if .1.is_given { "" } else { ", half of the free memory" },
    MemoryBudget::VARIABLE
)]
pub struct OverBudget(u64, ReadingBudget);

/// Returns a number of bytes in GB, or in MB if it is small.
fn size(bytes: u64) -> String {
    match bytes as f64 {
        bytes if bytes < 1e9 => format!("{:.0} MB", (bytes * 1e-6).ceil()),
        bytes => format!("{:.1} GB", bytes * 1e-9),
    }
}

impl ReadingBudget {
    /// Returns the budget for reading a file now.
    pub fn now() -> Self {
        let machine = memory_budget();
        if let MemoryBudget::User(bytes) = machine {
            return Self::of(bytes, true);
        }
        let free = free_bytes(|path| fs::read_to_string(path).ok());
        Self::of(free.unwrap_or(machine.bytes()) / 2, false)
    }

    /// Returns a budget of `limit` bytes.
    pub fn of(limit: u64, is_given: bool) -> Self {
        Self {
            limit,
            used: 0,
            is_given,
        }
    }

    /// Counts `bytes` that are about to be allocated.
    ///
    /// # Errors
    /// If they exceed the budget together with those counted before.
    pub fn claim(&mut self, bytes: u64) -> Result<(), OverBudget> {
        let needed = self.used.saturating_add(bytes);
        if needed > self.limit {
            return Err(OverBudget(needed, *self));
        }
        self.used = needed;
        Ok(())
    }

    /// Returns `bytes` that were claimed and have been freed.
    pub fn release(&mut self, bytes: u64) {
        self.used = self.used.saturating_sub(bytes);
    }
}

/// Returns the free memory: the smallest of that of the machine, that left in the container, and that left below the limit of
/// the process (`ulimit -v`). `text` returns a file of Linux, if it can be read.
fn free_bytes(text: impl Fn(&str) -> Option<String>) -> Option<u64> {
    let bytes = |path, key| bytes_of(&text(path)?, key);
    let number = |path| text(path)?.trim().parse::<u64>().ok();
    let used_in_container = number("/sys/fs/cgroup/memory.current").unwrap_or(0);
    let container = number("/sys/fs/cgroup/memory.max").map(|limit| limit.saturating_sub(used_in_container));
    let limits = text("/proc/self/limits").unwrap_or_default();
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"));
    let limit = line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
    let used = bytes("/proc/self/status", "VmSize:").unwrap_or(0);
    let process = limit.map(|limit| limit.saturating_sub(used));
    let machine = bytes("/proc/meminfo", "MemAvailable:");
    [machine, container, process].into_iter().flatten().min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn claims_add_up_and_the_message_names_the_sizes_and_the_options() {
        let mut budget = ReadingBudget::of(1_000_000_000, false);
        budget.claim(600_000_000).unwrap();
        let over = budget.claim(500_000_000).unwrap_err().to_string();
        for part in [
            "needs 1.1 GB",
            "may use 1.0 GB, half of the free memory",
            "DECOUPLER_MEMORY_GB",
        ] {
            assert!(over.contains(part), "{over}");
        }
        budget.release(600_000_000);
        budget.claim(1_000_000_000).unwrap();
        assert!(budget.claim(u64::MAX).is_err());
        assert!(
            !ReadingBudget::of(1, true)
                .claim(2)
                .unwrap_err()
                .to_string()
                .contains("half")
        );
    }

    #[test]
    fn free_memory_is_the_smallest_of_machine_container_and_process() {
        let free = |container: Option<&str>, limits: &str| {
            free_bytes(|path| {
                Some(match path {
                    "/proc/meminfo" => "MemTotal: 100 kB\nMemAvailable:   50000000 kB\n".to_owned(),
                    "/proc/self/status" => "VmPeak: 9 kB\nVmSize:\t   20000 kB\n".to_owned(),
                    "/proc/self/limits" => {
                        format!("Max address space         {limits}            unlimited            bytes\n")
                    }
                    "/sys/fs/cgroup/memory.max" => container?.to_owned(),
                    "/sys/fs/cgroup/memory.current" => container.map(|_| "1000000\n")?.to_owned(),
                    _ => panic!("{path}"),
                })
            })
        };
        assert_eq!(free(None, "unlimited"), Some(50_000_000 * 1024));
        assert_eq!(free(Some("max\n"), "unlimited"), Some(50_000_000 * 1024));
        assert_eq!(free(Some("3000000\n"), "unlimited"), Some(2_000_000));
        assert_eq!(free(None, "1000000000"), Some(1_000_000_000 - 20_480_000));
        assert_eq!(free(None, "1000"), Some(0));
        assert_eq!(free_bytes(|_| None), None);
    }
}
