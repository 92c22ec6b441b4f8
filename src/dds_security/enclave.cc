#include "dds_security/enclave.h"

#include <array>
#include <cerrno>
#include <cstddef>
#include <memory>
#include <optional>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/x509_vfy.h>
#include <sys/stat.h>
#include <unistd.h>

#include "dds_security/openssl.h"

namespace fastcycle::dds_security {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBytesMax = 1U << 20U;

using Errors = std::vector<std::string>;
using Store = std::unique_ptr<X509_STORE, Free<&X509_STORE_free>>;
using StoreContext = std::unique_ptr<X509_STORE_CTX, Free<&X509_STORE_CTX_free>>;

struct FreeStack {
  // The certificates in it are borrowed.
  void operator()(STACK_OF(X509) * stack) const { sk_X509_free(stack); }
};

void add_error(Errors& errors, const fs::path& file, std::string_view expected,
               std::string_view found) {
  errors.push_back(fmt::format("{}: expected {}, found {}", file.string(), expected, found));
}

/// The content of the file; none, and an error, if it cannot be read.
std::optional<std::string> read(const fs::path& file, std::string_view expected, Errors& errors) {
  const auto fail = [&](std::string_view found) -> std::optional<std::string> {
    add_error(errors, file, expected, found);
    return {};
  };
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) {
    return fail(errno == ENOENT ? "no such file" : std::system_category().message(errno));
  }
  struct stat state{};
  std::string text;
  ssize_t count = ::fstat(descriptor, &state) == 0 && S_ISREG(state.st_mode) ? 1 : -1;
  std::array<char, 4096> bytes{};
  while (count > 0 && text.size() <= kBytesMax) {
    count = ::read(descriptor, bytes.data(), bytes.size());
    text.append(bytes.data(), count > 0 ? static_cast<std::size_t>(count) : 0);
  }
  ::close(descriptor);
  if (count != 0) {
    return fail(text.size() > kBytesMax ? "more than 1 MiB" : "something that is no regular file");
  }
  return text;
}

X509Ptr read_certificate(const fs::path& file, std::string_view of, Errors& errors) {
  const std::string expected = fmt::format("{} in PEM", of);
  const auto text = read(file, expected, errors);
  if (!text) {
    return nullptr;
  }
  X509Ptr certificate = certificate_of(*text);
  if (certificate == nullptr) {
    add_error(errors, file, expected, "no certificate");
  }
  return certificate;
}

std::string time_text(const ASN1_TIME* time) {
  const Bio memory(::BIO_new(::BIO_s_mem()));
  return ::ASN1_TIME_print(memory.get(), time) == 1 ? text_of(*memory) : "an unreadable time";
}

void check_time(X509& certificate, const fs::path& file, Errors& errors) {
  const ASN1_TIME* const begin = ::X509_get0_notBefore(&certificate);
  const ASN1_TIME* const end = ::X509_get0_notAfter(&certificate);
  if (::X509_cmp_current_time(begin) > 0) {
    add_error(errors, file, "a certificate that is valid now",
              "one that is valid from " + time_text(begin));
  } else if (::X509_cmp_current_time(end) < 0) {
    add_error(errors, file, "a certificate that is valid now",
              "one that has expired on " + time_text(end));
  }
}

std::string subject_of(X509& certificate) {
  const Bio memory(::BIO_new(::BIO_s_mem()));
  ::X509_NAME_print_ex(memory.get(), ::X509_get_subject_name(&certificate), 0, XN_FLAG_RFC2253);
  return text_of(*memory);
}

/// Times are looked at apart from this.
void check_signer(X509& certificate, const fs::path& file, X509& authority,
                  const fs::path& authority_file, Errors& errors) {
  const Store store(::X509_STORE_new());
  const StoreContext context(::X509_STORE_CTX_new());
  ::X509_STORE_add_cert(store.get(), &authority);
  ::X509_STORE_set_flags(store.get(), X509_V_FLAG_NO_CHECK_TIME | X509_V_FLAG_PARTIAL_CHAIN);
  ::X509_STORE_CTX_init(context.get(), store.get(), &certificate, nullptr);
  if (::X509_verify_cert(context.get()) != 1) {
    add_error(
        errors, file,
        fmt::format("a certificate that is signed by the authority in {}",
                    authority_file.filename().string()),
        fmt::format("that of {}: {}", subject_of(certificate),
                    ::X509_verify_cert_error_string(::X509_STORE_CTX_get_error(context.get()))));
  }
}

/// The document; none, and an error, if `authority` has not signed it.
std::optional<std::string> read_signed(const fs::path& file, X509* authority, Errors& errors) {
  const std::string expected =
      "a document that is signed by the authority in "
      "permissions_ca.cert.pem";
  const auto text = read(file, expected, errors);
  if (!text || authority == nullptr) {
    return {};
  }
  BIO* content = nullptr;
  const Bio in = read_from(*text);
  const Pkcs7 signature(::SMIME_read_PKCS7(in.get(), &content));
  const Bio whole(content);
  if (signature == nullptr || content == nullptr) {
    add_error(errors, file, expected, "no S/MIME");
    return {};
  }
  const std::unique_ptr<STACK_OF(X509), FreeStack> signers(sk_X509_new_null());
  sk_X509_push(signers.get(), authority);
  const Bio out(::BIO_new(::BIO_s_mem()));
  if (::PKCS7_verify(signature.get(), signers.get(), nullptr, content, out.get(),
                     PKCS7_TEXT | PKCS7_NOINTERN | PKCS7_NOVERIFY) != 1) {
    add_error(errors, file, expected, "one that was changed, or that another authority has signed");
    return {};
  }
  return text_of(*out);
}

}  // namespace

Enclave enclave_in(const fs::path& folder) {
  const fs::path whole = fs::absolute(folder);
  return {.identity_ca = whole / "identity_ca.cert.pem",
          .certificate = whole / "cert.pem",
          .key = whole / "key.pem",
          .permissions_ca = whole / "permissions_ca.cert.pem",
          .governance = whole / "governance.p7s",
          .permissions = whole / "permissions.p7s"};
}

std::vector<std::string> enclave_errors(const fs::path& folder) {
  Errors errors;
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    add_error(errors, folder, "the folder of an enclave",
              fs::exists(folder, error) ? "something that is no folder" : "nothing");
    return errors;
  }
  if (fs::is_directory(folder / "enclaves", error)) {
    add_error(errors, folder, "the folder of one enclave",
              fmt::format("a keystore; its enclaves are in {}", (folder / "enclaves").string()));
    return errors;
  }
  const Enclave files = enclave_in(folder);
  const X509Ptr authority =
      read_certificate(files.identity_ca, "the certificate of an authority", errors);
  const X509Ptr certificate =
      read_certificate(files.certificate, "the certificate of the participant", errors);
  const X509Ptr signer =
      read_certificate(files.permissions_ca, "the certificate of an authority", errors);
  if (const auto text = read(files.key, "a private key in PEM", errors)) {
    const Key key = key_of(*text);
    if (key == nullptr) {
      add_error(errors, files.key, "a private key in PEM, without a password", "none");
    } else if (certificate != nullptr &&
               ::X509_check_private_key(certificate.get(), key.get()) != 1) {
      add_error(errors, files.key, "the private key of the certificate in cert.pem", "another one");
    }
  }
  if (authority != nullptr) {
    check_time(*authority, files.identity_ca, errors);
  }
  if (certificate != nullptr) {
    check_time(*certificate, files.certificate, errors);
    if (authority != nullptr) {
      check_signer(*certificate, files.certificate, *authority, files.identity_ca, errors);
    }
  }
  (void)read_signed(files.governance, signer.get(), errors);
  const auto permissions = read_signed(files.permissions, signer.get(), errors);
  if (permissions && certificate != nullptr) {
    // A name of several parts has several notations, which DDS accepts.
    const std::string subject = subject_of(*certificate);
    if (subject.starts_with("CN=") && subject.find(',') == std::string::npos &&
        permissions->find(subject) == std::string::npos) {
      add_error(errors, files.permissions, fmt::format("permissions of {}", subject),
                "those of others");
    }
  }
  ::ERR_clear_error();
  return errors;
}

bool has_open_key(const fs::path& folder) {
  struct stat state{};
  return ::stat(enclave_in(folder).key.c_str(), &state) == 0 &&
         (state.st_mode & (S_IRGRP | S_IROTH)) != 0;
}

std::string name_of_enclave(const fs::path& folder) {
  Errors errors;
  const X509Ptr certificate =
      read_certificate(enclave_in(folder).certificate, "a certificate", errors);
  ::ERR_clear_error();
  const std::string subject = certificate == nullptr ? "" : subject_of(*certificate);
  return subject.starts_with("CN=") && subject.find(',') == std::string::npos ? subject.substr(3)
                                                                              : "";
}

}  // namespace fastcycle::dds_security
