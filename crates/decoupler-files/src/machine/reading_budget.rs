use std::fs;

use decoupler_core::machine::MemoryBudget;
use thiserror::Error;

use super::memory_budget;

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

/// A file needs more memory than reading may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "it needs {} of memory, and reading may use {}{}; use a part of it, or raise the limit with the option --memory-limit or \
     the environment variable {} (in GB)",
    size(*.needed),
    size(*.limit),
    if *.is_given { "" } else { ", half of the free memory" },
    MemoryBudget::VARIABLE
)]
pub struct OverBudget {
    /// Bytes needed.
    pub needed: u64,
    /// Bytes that reading may use.
    pub limit: u64,
    /// `true` if the user has set the limit.
    pub is_given: bool,
}

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
        let text = |path: &str| fs::read_to_string(path).ok();
        let free = free_bytes(&Texts {
            meminfo: text("/proc/meminfo"),
            status: text("/proc/self/status"),
            limits: text("/proc/self/limits"),
            container_limit: text("/sys/fs/cgroup/memory.max"),
            container_use: text("/sys/fs/cgroup/memory.current"),
        });
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
            let Self { limit, is_given, .. } = *self;
            return Err(OverBudget {
                needed,
                limit,
                is_given,
            });
        }
        self.used = needed;
        Ok(())
    }

    /// Returns `bytes` that were claimed and have been freed.
    pub fn release(&mut self, bytes: u64) {
        self.used = self.used.saturating_sub(bytes);
    }
}

/// Files of Linux that state memory, as far as they can be read.
#[derive(Default)]
struct Texts {
    meminfo: Option<String>,
    status: Option<String>,
    limits: Option<String>,
    container_limit: Option<String>,
    container_use: Option<String>,
}

/// Returns the free memory: the smallest of that of the machine, that left in the container, and that left below the limit of
/// the process (`ulimit -v`).
fn free_bytes(texts: &Texts) -> Option<u64> {
    let number = |text: &Option<String>| text.as_ref()?.trim().parse::<u64>().ok();
    let kibibytes = |text: &Option<String>, key: &str| {
        let line = text.as_ref()?.lines().find_map(|line| line.strip_prefix(key))?;
        let count: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
        Some(count * 1024)
    };
    let machine = kibibytes(&texts.meminfo, "MemAvailable:");
    let used_in_container = number(&texts.container_use).unwrap_or(0);
    let container = number(&texts.container_limit).map(|limit| limit.saturating_sub(used_in_container));
    let limit = texts.limits.as_ref().and_then(|limits| {
        let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
        line.split_whitespace().next()?.parse::<u64>().ok()
    });
    let used = kibibytes(&texts.status, "VmSize:").unwrap_or(0);
    let process = limit.map(|limit| limit.saturating_sub(used));
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
            "--memory-limit",
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
        let texts = |container: Option<&str>, limits: &str| Texts {
            meminfo: Some("MemTotal: 100 kB\nMemAvailable:   50000000 kB\n".to_owned()),
            status: Some("VmPeak: 9 kB\nVmSize:\t   20000 kB\n".to_owned()),
            limits: Some(format!(
                "Max address space         {limits}            unlimited            bytes\n"
            )),
            container_limit: container.map(str::to_owned),
            container_use: container.map(|_| "1000000\n".to_owned()),
        };
        assert_eq!(free_bytes(&texts(None, "unlimited")), Some(50_000_000 * 1024));
        assert_eq!(free_bytes(&texts(Some("max\n"), "unlimited")), Some(50_000_000 * 1024));
        assert_eq!(free_bytes(&texts(Some("3000000\n"), "unlimited")), Some(2_000_000));
        assert_eq!(free_bytes(&texts(None, "1000000000")), Some(1_000_000_000 - 20_480_000));
        assert_eq!(free_bytes(&texts(None, "1000")), Some(0));
        assert_eq!(free_bytes(&Texts::default()), None);
    }
}
