/* Preloaded into a program: of its operations that write to the folder FAULT_FOLDER, counted since the file FAULT_PLAN was
 * written, the one that this file names fails. Its contents are the number of the operation and a kind: "short" (half is
 * written, then the disk is full), or the number of an error. It is removed when the operation has failed. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

/* Operations since the plan was written, and the plan that they are counted for. */
static atomic_long count;
static atomic_int disk_is_full;
static struct timespec plan_time;

static const char *setting(const char *name)
{
    const char *value = getenv(name);
    return value ? value : "";
}

static int is_watched(const char *path)
{
    const char *folder = setting("FAULT_FOLDER");
    char full[PATH_MAX];
    if (path[0] != '/') {
        char working[PATH_MAX];
        if (!getcwd(working, sizeof working) || snprintf(full, sizeof full, "%s/%s", working, path) >= (int)sizeof full)
            return 0;
        path = full;
    }
    return folder[0] && strncmp(path, folder, strlen(folder)) == 0;
}

static int is_watched_file(int file)
{
    char link[64], path[PATH_MAX];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0)
        return 0;
    path[length] = 0;
    return is_watched(path);
}

/* Returns 0, or the error with which this operation fails: -1 for a short write. */
static int fault(void)
{
    struct stat plan;
    if (stat(setting("FAULT_PLAN"), &plan) != 0)
        return 0;
    if (memcmp(&plan.st_mtim, &plan_time, sizeof plan_time) != 0) {
        plan_time = plan.st_mtim;
        atomic_store(&count, 0);
        atomic_store(&disk_is_full, 0);
    }
    long at = 0;
    char kind[16] = "";
    FILE *file = fopen(setting("FAULT_PLAN"), "r");
    if (!file)
        return 0;
    int read = fscanf(file, "%ld %15s", &at, kind);
    fclose(file);
    if (read != 2 || atomic_fetch_add(&count, 1) + 1 != at)
        return 0;
    unlink(setting("FAULT_PLAN"));
    if (strcmp(kind, "short") == 0) {
        atomic_store(&disk_is_full, 1);
        return -1;
    }
    return atoi(kind);
}

static int fails(void)
{
    int error = fault();
    if (error == 0)
        return 0;
    errno = error < 0 ? ENOSPC : error;
    return 1;
}

static int open_as(const char *name, const char *path, int flags, mode_t mode)
{
    int (*next)(const char *, int, ...) = dlsym(RTLD_NEXT, name);
    if ((flags & (O_WRONLY | O_RDWR | O_CREAT)) && is_watched(path) && fails())
        return -1;
    return next(path, flags, mode);
}

#define OPEN(name)                                       \
    int name(const char *path, int flags, ...)           \
    {                                                    \
        va_list rest;                                    \
        va_start(rest, flags);                           \
        mode_t mode = va_arg(rest, mode_t);              \
        va_end(rest);                                    \
        return open_as(#name, path, flags, mode);        \
    }

OPEN(open)
OPEN(open64)

ssize_t write(int file, const void *bytes, size_t length)
{
    ssize_t (*next)(int, const void *, size_t) = dlsym(RTLD_NEXT, "write");
    if (is_watched_file(file)) {
        int error = fault();
        if (error == 0 && atomic_load(&disk_is_full)) {
            errno = ENOSPC;
            return -1;
        }
        if (error < 0)
            return next(file, bytes, length > 1 ? length / 2 : length);
        if (error > 0) {
            errno = error;
            return -1;
        }
    }
    return next(file, bytes, length);
}

#define ONE_FILE(name)                                   \
    int name(int file)                                   \
    {                                                    \
        int (*next)(int) = dlsym(RTLD_NEXT, #name);      \
        if (is_watched_file(file) && fails())            \
            return -1;                                   \
        return next(file);                               \
    }

ONE_FILE(fsync)
ONE_FILE(fdatasync)

int mkdir(const char *path, mode_t mode)
{
    int (*next)(const char *, mode_t) = dlsym(RTLD_NEXT, "mkdir");
    if (is_watched(path) && fails())
        return -1;
    return next(path, mode);
}

int rename(const char *from, const char *to)
{
    int (*next)(const char *, const char *) = dlsym(RTLD_NEXT, "rename");
    if (is_watched(to) && fails())
        return -1;
    return next(from, to);
}
