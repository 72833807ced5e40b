/* Notes every write and every sync of files named mission.db*, in their order, for a test that
   plays a power loss: what was not synced is dropped. The journal's index in shared memory is mapped, and
   made anew when it is opened. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <unistd.h>

static int trace = -2;

static void put(const void *data, size_t size) { syscall(SYS_write, trace, data, size); }

static void note(char kind, int fd, const char *name, const void *data, size_t size, off_t at) {
  char place[4096], link[64];
  if (trace == -2) {
    const char *path = getenv("POWER_TRACE");
    trace = path ? open(path, O_WRONLY | O_CREAT | O_APPEND, 0600) : -1;
  }
  if (trace < 0) return;
  if (!name) {
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, place, sizeof place - 1);
    if (length < 0) return;
    place[length] = 0;
    name = place;
  }
  const char *file = strrchr(name, '/');
  file = file ? file + 1 : name;
  if (strncmp(file, "mission.db", 10)) return;
  int64_t head[3] = {(int64_t)strlen(file), (int64_t)at, (int64_t)size};
  put(&kind, 1);
  put(head, sizeof head);
  put(file, head[0]);
  if (data) put(data, size);
}

#define REAL(type, name) static type (*real)(); if (!real) real = dlsym(RTLD_NEXT, name)

ssize_t pwrite64(int fd, const void *data, size_t size, off_t at) {
  REAL(ssize_t, "pwrite64");
  ssize_t done = real(fd, data, size, at);
  if (done > 0) note('w', fd, 0, data, done, at);
  return done;
}

ssize_t pwrite(int fd, const void *data, size_t size, off_t at) { return pwrite64(fd, data, size, at); }

ssize_t write(int fd, const void *data, size_t size) {
  REAL(ssize_t, "write");
  off_t at = lseek(fd, 0, SEEK_CUR);
  ssize_t done = real(fd, data, size);
  if (done > 0) note('w', fd, 0, data, done, at);
  return done;
}

int ftruncate64(int fd, off_t size) {
  REAL(int, "ftruncate64");
  int done = real(fd, size);
  if (!done) note('t', fd, 0, 0, 0, size);
  return done;
}

int ftruncate(int fd, off_t size) { return ftruncate64(fd, size); }

int fsync(int fd) {
  REAL(int, "fsync");
  int done = real(fd);
  if (!done) note('s', fd, 0, 0, 0, 0);
  return done;
}

int fdatasync(int fd) {
  REAL(int, "fdatasync");
  int done = real(fd);
  if (!done) note('s', fd, 0, 0, 0, 0);
  return done;
}

int unlink(const char *name) {
  REAL(int, "unlink");
  int done = real(name);
  if (!done) note('u', -1, name, 0, 0, 0);
  return done;
}
