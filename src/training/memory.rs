use std::{fmt, fs, sync::OnceLock};

/// Memory that trainings may take: all that the machine has, or what a container leaves of it. Where the system does not
/// tell, [`Self::ASSUMED_BYTES`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MachineMemory {
    /// Size in bytes.
    pub bytes: u64,
    /// False if the system does not tell.
    pub is_known: bool,
}

impl MachineMemory {
    /// Memory that is assumed where the system does not tell, as that of an ordinary machine.
    pub const ASSUMED_BYTES: u64 = 8_000_000_000;

    /// Returns the memory of this machine, which is read the first time.
    pub fn of_this_machine() -> Self {
        static MEMORY: OnceLock<MachineMemory> = OnceLock::new();
        *MEMORY.get_or_init(|| {
            let meminfo = fs::read_to_string("/proc/meminfo").ok();
            let limit = fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
            Self::from_texts(meminfo.as_deref(), limit.as_deref())
        })
    }

    /// From the texts of `/proc/meminfo` and of the container's limit.
    fn from_texts(meminfo: Option<&str>, limit: Option<&str>) -> Self {
        let limit = limit.and_then(|text| text.trim().parse().ok());
        let least = [meminfo.and_then(total_bytes), limit].into_iter().flatten().min();
        Self {
            bytes: least.unwrap_or(Self::ASSUMED_BYTES),
            is_known: least.is_some(),
        }
    }
}

impl fmt::Display for MachineMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let gigabytes = self.bytes as f64 * 1e-9;
        if self.is_known {
            write!(f, "the machine has {gigabytes:.1} GB")
        } else {
            write!(f, "{gigabytes:.1} GB are assumed, since the system does not tell")
        }
    }
}

fn total_bytes(meminfo: &str) -> Option<u64> {
    let total = meminfo.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kibibytes: u64 = total.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEMINFO: &str = "MemTotal:       24683956 kB\nMemFree:        24097000 kB\n";

    #[test]
    fn the_memory_is_what_the_machine_and_its_container_leave() {
        let memory = |meminfo, limit| MachineMemory::from_texts(meminfo, limit);
        let known = |bytes| MachineMemory { bytes, is_known: true };
        assert_eq!(memory(Some(MEMINFO), None), known(24_683_956 * 1024));
        assert_eq!(memory(Some(MEMINFO), Some("max\n")), known(24_683_956 * 1024));
        assert_eq!(memory(Some(MEMINFO), Some("1000000\n")), known(1_000_000));
        assert_eq!(memory(Some(MEMINFO), None).to_string(), "the machine has 25.3 GB");
    }

    #[test]
    fn where_the_system_does_not_tell_the_message_says_what_is_assumed() {
        let memory = MachineMemory::from_texts(Some("MemFree: 5 kB\n"), None);
        assert_eq!((memory.bytes, memory.is_known), (MachineMemory::ASSUMED_BYTES, false));
        let text = memory.to_string();
        assert!(text.contains("8.0 GB are assumed"), "{text}");
    }
}
