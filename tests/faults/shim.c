/* Preloaded into the program: operations that write to the folder FAULT_FOLDER are counted, and the one with number FAULT_AT
 * fails as FAULT_KIND says: "short" (half is written, then the disk is full), or the number of an error. The count is written
 * to the file FAULT_COUNT at the end. */

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
#include <unistd.h>

static atomic_long count;
static atomic_int disk_is_full;

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

/* Returns 0, or the error with which this operation fails. */
static int fault(void)
{
    if (atomic_fetch_add(&count, 1) + 1 != atol(setting("FAULT_AT")))
        return 0;
    const char *kind = setting("FAULT_KIND");
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
        if (atomic_load(&disk_is_full)) {
            errno = ENOSPC;
            return -1;
        }
        int error = fault();
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

__attribute__((destructor)) static void report(void)
{
    FILE *file = fopen(setting("FAULT_COUNT"), "w");
    if (file) {
        fprintf(file, "%ld", atomic_load(&count));
        fclose(file);
    }
}
